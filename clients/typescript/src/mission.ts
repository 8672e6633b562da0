// Flies a UAV through its UAL daemon: take-off, a waypoint, velocities, a refused request, landing.
//
// Ctrl-C cancels the running call. The daemon then cancels a waypoint, and stops a UAV that gets no more
// velocities; the UAV holds its position. A take-off or a landing continues.

import { readFileSync } from "node:fs";
import { setTimeout as sleep } from "node:timers/promises";
import { parseArgs } from "node:util";

import type { MessageInitShape } from "@bufbuild/protobuf";
import { Code, ConnectError, createClient, type Client, type Interceptor } from "@connectrpc/connect";
import { createGrpcTransport } from "@connectrpc/connect-node";

import { ErrorInfoSchema, type ErrorInfo } from "./gen/google/rpc/error_details_pb.js";
import { State, UalService, type StreamSetpointsRequestSchema } from "./gen/ual/v1/ual_pb.js";

const ANSWER_LIMIT_MS = 5_000; // for calls that the daemon answers at once
const ARM_LIMIT_MS = 60_000; // for the safety pilot
const MANOEUVRE_LIMIT_MS = 60_000;
const SETPOINT_PERIOD_MS = 50; // the UAV stops after 0.5 s without a setpoint
const SETPOINT_COUNT = 40;
const LEASE_PERIOD_MS = 500; // a lease ends 2 s after it was kept last

interface Options {
  address: string;
  tlsCa: string | undefined;
  tokenFile: string | undefined;
  lease: boolean;
}

type Uav = Client<typeof UalService>;

async function run(options: Options, interruption: AbortSignal): Promise<void> {
  const metadata = new Map<string, string>(); // what each call carries
  const uav = createClient(UalService, transport(options, metadata));
  if (!options.lease) {
    return mission(uav, interruption);
  }
  const { leaseId } = await uav.acquireLease({ holder: "typescript mission" }, { timeoutMs: ANSWER_LIMIT_MS });
  console.log("holds the lease");
  metadata.set("ual-lease", leaseId);
  const over = new AbortController();
  const kept = keepLease(uav, leaseId, over);
  try {
    await mission(uav, AbortSignal.any([interruption, over.signal]));
  } finally {
    over.abort();
    await kept;
    await uav.releaseLease({ leaseId }, { timeoutMs: ANSWER_LIMIT_MS });
  }
}

/** How to connect: with TLS where there are certificates to trust, with a token where there is one. */
function transport({ address, tlsCa, tokenFile }: Options, metadata: Map<string, string>) {
  if (tokenFile !== undefined) {
    if (tlsCa === undefined) {
      throw new Error("a token is sent only by TLS: give --tls-ca");
    }
    metadata.set("authorization", `Bearer ${readFileSync(tokenFile, "utf8").trim()}`);
  }
  const carrying: Interceptor = (next) => (request) => {
    for (const [key, value] of metadata) {
      request.header.set(key, value);
    }
    return next(request);
  };
  return createGrpcTransport({
    baseUrl: tlsCa === undefined ? `http://${address}` : `https://${address}`,
    nodeOptions: tlsCa === undefined ? {} : { ca: readFileSync(tlsCa) },
    interceptors: [carrying],
  });
}

/** Keeps a lease until it is over, and ends what is under way when it is lost. */
async function keepLease(uav: Uav, leaseId: string, over: AbortController): Promise<void> {
  while (!over.signal.aborted) {
    await sleep(LEASE_PERIOD_MS, undefined, { signal: over.signal }).catch(() => undefined);
    try {
      await uav.keepLease({ leaseId }, { timeoutMs: LEASE_PERIOD_MS, signal: over.signal });
    } catch (error) {
      if (errorInfo(error)?.reason === "LEASE_LOST") {
        over.abort(error);
      }
    }
  }
}

async function mission(uav: Uav, signal: AbortSignal): Promise<void> {

  const info = await uav.getInfo({}, { timeoutMs: ANSWER_LIMIT_MS, signal });
  console.log(`${info.namespace}: backend ${info.backend}, UAL ${info.ualVersion}`);
  await waitUntilArmed(uav, signal);

  const landed = new AbortController();
  const watched = watch(uav, AbortSignal.any([signal, landed.signal]));
  try {
    await Promise.race([fly(uav, info.namespace, signal), failureOf(watched)]);
  } finally {
    landed.abort();
  }
  await watched;
  console.log("done");
}

async function fly(uav: Uav, ns: string, signal: AbortSignal): Promise<void> {
  console.log("take-off to 3 m");
  await uav.takeOff({ heightM: 3 }, { timeoutMs: MANOEUVRE_LIMIT_MS, signal });

  const yawRad = Math.PI / 2;
  console.log(`waypoint 4 2 3 m, heading ${yawRad.toFixed(2)} rad`);
  const pose = {
    position: { x: 4, y: 2, z: 3 }, // in <ns>/odom
    orientation: { z: Math.sin(yawRad / 2), w: Math.cos(yawRad / 2) },
  };
  await uav.goToWaypoint({ waypoint: { pose } }, { timeoutMs: MANOEUVRE_LIMIT_MS, signal });

  console.log("0.5 m/s forward for 2 s");
  const { acceptedCount } = await uav.streamSetpoints(velocities(ns, signal), {
    timeoutMs: SETPOINT_COUNT * SETPOINT_PERIOD_MS + ANSWER_LIMIT_MS,
    signal,
  });
  if (acceptedCount !== BigInt(SETPOINT_COUNT)) {
    throw new Error(`${acceptedCount} of ${SETPOINT_COUNT} setpoints were accepted`);
  }

  await showRefusal(uav, signal);

  console.log("landing");
  await uav.land({}, { timeoutMs: MANOEUVRE_LIMIT_MS, signal });
}

async function waitUntilArmed(uav: Uav, signal: AbortSignal): Promise<void> {
  const armed = new AbortController();
  // Not timeoutMs: its timer would keep the program running after the stream was left early.
  const limit = AbortSignal.timeout(ARM_LIMIT_MS);
  const options = { signal: AbortSignal.any([signal, armed.signal, limit]) };
  let shown = State.UNSPECIFIED;
  try {
    for await (const { telemetry } of uav.streamTelemetry({ rateHz: 10 }, options)) {
      const state = telemetry?.state ?? State.UNSPECIFIED;
      if (state === State.LANDED_ARMED) {
        return;
      }
      if (state !== shown) {
        console.log(`${State[state]}: waiting for the safety pilot to arm`);
        shown = state;
      }
    }
  } finally {
    armed.abort(); // leaving the loop does not close the stream
  }
  throw new Error("the daemon ended the telemetry before the UAV was armed");
}

/** Prints the position of the UAV until the signal aborts it. */
async function watch(uav: Uav, signal: AbortSignal): Promise<void> {
  try {
    for await (const { telemetry } of uav.streamTelemetry({ rateHz: 2 }, { signal })) {
      const { x, y, z } = telemetry?.pose?.position ?? { x: NaN, y: NaN, z: NaN };
      const state = State[telemetry?.state ?? State.UNSPECIFIED];
      console.log(`  ${state} at ${x.toFixed(1)} ${y.toFixed(1)} ${z.toFixed(1)} m`);
    }
  } catch (error) {
    if (!signal.aborted) {
      throw error;
    }
  }
}

/** Never resolves. Rejects when the promise rejects. */
function failureOf(promise: Promise<void>): Promise<never> {
  return new Promise((_, reject) => promise.catch(reject));
}

/** Yields 0.5 m/s forward, SETPOINT_COUNT times. */
async function* velocities(
  ns: string,
  signal: AbortSignal,
): AsyncGenerator<MessageInitShape<typeof StreamSetpointsRequestSchema>> {
  for (let sent = 0; sent < SETPOINT_COUNT; sent++) {
    yield {
      setpoint: {
        case: "velocity",
        value: { header: { frameId: `${ns}/base_link` }, twist: { linear: { x: 0.5 } } },
      },
    };
    await sleep(SETPOINT_PERIOD_MS, undefined, { signal });
  }
}

/** Sends a command that is not allowed in FLYING_AUTO and reads the reason of the refusal. */
async function showRefusal(uav: Uav, signal: AbortSignal): Promise<void> {
  try {
    await uav.recoverFromManual({}, { timeoutMs: ANSWER_LIMIT_MS, signal });
  } catch (error) {
    const info = errorInfo(error);
    if (info?.reason !== "WRONG_STATE") {
      throw error;
    }
    const { rawMessage } = ConnectError.from(error);
    console.log(`recover is refused: ${info.reason} (state ${info.metadata["state"]}): ${rawMessage}`);
    return;
  }
  throw new Error("recover was not refused in FLYING_AUTO");
}

/** Returns UAL's reason, or undefined if the error comes from gRPC: no connection, a deadline, a cancellation. */
function errorInfo(error: unknown): ErrorInfo | undefined {
  return ConnectError.from(error)
    .findDetails(ErrorInfoSchema)
    .find((info) => info.domain === "ual");
}

function explain(error: unknown): string {
  if (!(error instanceof ConnectError)) {
    return String(error);
  }
  return `${errorInfo(error)?.reason ?? Code[error.code]}: ${error.rawMessage}`;
}

const { values } = parseArgs({
  options: {
    address: { type: "string", default: "127.0.0.1:50051" },
    "tls-ca": { type: "string" },
    "token-file": { type: "string" },
    lease: { type: "boolean", default: false },
  },
});
const { address, lease, "tls-ca": tlsCa, "token-file": tokenFile } = values;
const interrupted = new AbortController();
for (const name of ["SIGINT", "SIGTERM"] as const) {
  process.once(name, () => interrupted.abort());
}

try {
  await run({ address, tlsCa, tokenFile, lease }, interrupted.signal);
} catch (error) {
  if (interrupted.signal.aborted) {
    console.error("interrupted: the UAV holds its position (a take-off or landing goes on)");
    process.exitCode = 130;
  } else {
    console.error(`mission: ${explain(error)}`);
    process.exitCode = 1;
  }
}
