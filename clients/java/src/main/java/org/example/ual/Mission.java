package org.example.ual;

import com.google.protobuf.InvalidProtocolBufferException;
import com.google.rpc.ErrorInfo;
import io.grpc.Context;
import io.grpc.Grpc;
import io.grpc.InsecureChannelCredentials;
import io.grpc.ManagedChannel;
import io.grpc.Status;
import io.grpc.StatusRuntimeException;
import io.grpc.protobuf.StatusProto;
import io.grpc.stub.ClientCallStreamObserver;
import io.grpc.stub.ClientResponseObserver;
import java.util.Locale;
import java.util.Optional;
import java.util.concurrent.CompletableFuture;
import java.util.concurrent.CountDownLatch;
import java.util.concurrent.ExecutionException;
import java.util.concurrent.TimeUnit;
import ual.v1.Ual.GetInfoRequest;
import ual.v1.Ual.GoToWaypointRequest;
import ual.v1.Ual.Header;
import ual.v1.Ual.LandRequest;
import ual.v1.Ual.Pose;
import ual.v1.Ual.PoseStamped;
import ual.v1.Ual.Quaternion;
import ual.v1.Ual.RecoverFromManualRequest;
import ual.v1.Ual.State;
import ual.v1.Ual.StreamSetpointsRequest;
import ual.v1.Ual.StreamSetpointsResponse;
import ual.v1.Ual.StreamTelemetryRequest;
import ual.v1.Ual.TakeOffRequest;
import ual.v1.Ual.Twist;
import ual.v1.Ual.TwistStamped;
import ual.v1.Ual.Vector3;
import ual.v1.UalServiceGrpc;
import ual.v1.UalServiceGrpc.UalServiceBlockingStub;

/**
 * Flies a UAV through its UAL daemon: take-off, a waypoint, velocities, a refused request, landing.
 *
 * <p>Ctrl-C cancels the running call. The daemon then cancels a waypoint, and stops a UAV that gets no more
 * velocities; the UAV holds its position. A take-off or a landing continues.
 */
public final class Mission {
  /** For calls that the daemon answers at once. */
  private static final long ANSWER_LIMIT_MS = 5_000;

  /** For the first call: meanwhile the JVM loads the classes of gRPC, and the channel connects. */
  private static final long FIRST_ANSWER_LIMIT_MS = 30_000;

  /** For the safety pilot. */
  private static final long ARM_LIMIT_MS = 60_000;

  private static final long MANOEUVRE_LIMIT_MS = 60_000;

  /** The UAV stops after 0.5 s without a setpoint. */
  private static final long SETPOINT_PERIOD_MS = 50;

  private static final int SETPOINT_COUNT = 40;

  private final ManagedChannel channel;

  private Mission(ManagedChannel channel) {
    this.channel = channel;
  }

  public static void main(String[] arguments) throws InterruptedException {
    String address = "127.0.0.1:50051";
    if (arguments.length == 2 && arguments[0].equals("--address")) {
      address = arguments[1];
    } else if (arguments.length != 0) {
      System.err.println("usage: mission [--address HOST:PORT]");
      System.exit(2);
    }

    // The JVM runs this hook at exit. After Ctrl-C `main` still runs: cancel every call and wait for its end.
    Context.CancellableContext flight = Context.current().withCancellation();
    CountDownLatch ended = new CountDownLatch(1);
    Runtime.getRuntime().addShutdownHook(new Thread(() -> {
      if (ended.getCount() == 0) {
        return;
      }
      System.err.println("interrupted: the UAV holds its position (a take-off or landing goes on)");
      flight.cancel(null);
      await(ended);
    }));

    ManagedChannel channel = Grpc.newChannelBuilder(address, InsecureChannelCredentials.create()).build();
    int exitStatus = 0;
    try {
      flight.call(() -> {
        new Mission(channel).run();
        return null;
      });
    } catch (Exception error) {
      exitStatus = 1;
      if (!flight.isCancelled()) {
        System.err.println("mission: " + explain(error));
      }
    } finally {
      channel.shutdownNow().awaitTermination(ANSWER_LIMIT_MS, TimeUnit.MILLISECONDS);
      ended.countDown();
    }
    System.exit(exitStatus); // an interrupted JVM keeps the status of the signal
  }

  private void run() throws Exception {
    var info = within(FIRST_ANSWER_LIMIT_MS).getInfo(GetInfoRequest.getDefaultInstance());
    System.out.printf("%s: backend %s, UAL %s%n", info.getNamespace(), info.getBackend(), info.getUalVersion());
    waitUntilArmed();

    Context.CancellableContext watching = Context.current().withCancellation();
    CompletableFuture<Void> watched = CompletableFuture.runAsync(watching.wrap(this::watch));
    try {
      takeOff(3);
      goTo(4, 2, 3, Math.PI / 2);
      streamVelocities(info.getNamespace());
      showRefusal();
      land();
    } finally {
      watching.cancel(null);
    }
    watched.get();
    System.out.println("done");
  }

  private void waitUntilArmed() {
    // Telemetry does not end by itself: leaving this method cancels it.
    Context.CancellableContext waiting = Context.current().withCancellation();
    waiting.run(() -> {
      var request = StreamTelemetryRequest.newBuilder().setRateHz(10).build();
      State shown = State.STATE_UNSPECIFIED;
      try {
        for (var samples = within(ARM_LIMIT_MS).streamTelemetry(request); samples.hasNext(); ) {
          State state = samples.next().getTelemetry().getState();
          if (state == State.STATE_LANDED_ARMED) {
            return;
          }
          if (state != shown) {
            System.out.printf("%s: waiting for the safety pilot to arm%n", name(state));
            shown = state;
          }
        }
      } finally {
        waiting.cancel(null);
      }
      throw new IllegalStateException("the daemon ended the telemetry before the UAV was armed");
    });
  }

  /** Prints the position of the UAV until its context is cancelled. */
  private void watch() {
    try {
      var samples = UalServiceGrpc.newBlockingStub(channel)
          .streamTelemetry(StreamTelemetryRequest.newBuilder().setRateHz(2).build());
      while (samples.hasNext()) {
        var telemetry = samples.next().getTelemetry();
        Vector3 position = telemetry.getPose().getPosition();
        System.out.printf(Locale.ROOT, "  %s at %.1f %.1f %.1f m%n",
            name(telemetry.getState()), position.getX(), position.getY(), position.getZ());
      }
    } catch (StatusRuntimeException error) {
      if (error.getStatus().getCode() != Status.Code.CANCELLED) {
        throw error;
      }
    }
  }

  private void takeOff(double heightM) {
    System.out.printf(Locale.ROOT, "take-off to %.0f m%n", heightM);
    within(MANOEUVRE_LIMIT_MS).takeOff(TakeOffRequest.newBuilder().setHeightM(heightM).build());
  }

  /** Flies to a position (m) and heading in the frame {@code <ns>/odom}. If the call ends early, the UAV holds. */
  private void goTo(double x, double y, double z, double yawRad) {
    System.out.printf(Locale.ROOT, "waypoint %.0f %.0f %.0f m, heading %.2f rad%n", x, y, z, yawRad);
    Pose pose = Pose.newBuilder()
        .setPosition(Vector3.newBuilder().setX(x).setY(y).setZ(z))
        .setOrientation(Quaternion.newBuilder().setZ(Math.sin(yawRad / 2)).setW(Math.cos(yawRad / 2)))
        .build();
    within(MANOEUVRE_LIMIT_MS).goToWaypoint(
        GoToWaypointRequest.newBuilder().setWaypoint(PoseStamped.newBuilder().setPose(pose)).build());
  }

  /** Flies forward at 0.5 m/s for SETPOINT_COUNT periods. */
  private void streamVelocities(String ns) throws Exception {
    System.out.println("0.5 m/s forward for 2 s");
    StreamSetpointsRequest setpoint = StreamSetpointsRequest.newBuilder()
        .setVelocity(TwistStamped.newBuilder()
            .setHeader(Header.newBuilder().setFrameId(ns + "/base_link"))
            .setTwist(Twist.newBuilder().setLinear(Vector3.newBuilder().setX(0.5))))
        .build();
    SetpointStream stream = new SetpointStream();
    UalServiceGrpc.newStub(channel)
        .withDeadlineAfter(SETPOINT_COUNT * SETPOINT_PERIOD_MS + ANSWER_LIMIT_MS, TimeUnit.MILLISECONDS)
        .streamSetpoints(stream);
    // If the stream has ended, `answer` below returns the reason.
    for (int sent = 0; sent < SETPOINT_COUNT && !stream.answer.isDone(); sent++) {
      stream.requests.onNext(setpoint);
      Thread.sleep(SETPOINT_PERIOD_MS);
    }
    if (!stream.answer.isDone()) {
      stream.requests.onCompleted();
    }
    long accepted = stream.answer.get().getAcceptedCount();
    if (accepted != SETPOINT_COUNT) {
      throw new IllegalStateException(accepted + " of " + SETPOINT_COUNT + " setpoints were accepted");
    }
  }

  /** A stream of setpoints and its single answer. */
  private static final class SetpointStream
      implements ClientResponseObserver<StreamSetpointsRequest, StreamSetpointsResponse> {
    final CompletableFuture<StreamSetpointsResponse> answer = new CompletableFuture<>();
    ClientCallStreamObserver<StreamSetpointsRequest> requests;

    @Override
    public void beforeStart(ClientCallStreamObserver<StreamSetpointsRequest> requests) {
      this.requests = requests;
    }

    @Override
    public void onNext(StreamSetpointsResponse response) {
      answer.complete(response);
    }

    @Override
    public void onError(Throwable error) {
      answer.completeExceptionally(error);
    }

    @Override
    public void onCompleted() {
      answer.completeExceptionally(new IllegalStateException("the stream ended without an answer"));
    }
  }

  /** Sends a command that is not allowed in FLYING_AUTO and reads the reason of the refusal. */
  private void showRefusal() {
    try {
      within(ANSWER_LIMIT_MS).recoverFromManual(RecoverFromManualRequest.getDefaultInstance());
    } catch (StatusRuntimeException error) {
      ErrorInfo info = errorInfo(error).filter(each -> each.getReason().equals("WRONG_STATE")).orElseThrow(() -> error);
      System.out.printf("recover is refused: %s (state %s): %s%n",
          info.getReason(), info.getMetadataOrDefault("state", "not told"), error.getStatus().getDescription());
      return;
    }
    throw new IllegalStateException("recover was not refused in FLYING_AUTO");
  }

  private void land() {
    System.out.println("landing");
    within(MANOEUVRE_LIMIT_MS).land(LandRequest.getDefaultInstance());
  }

  /** Returns a stub for one call. Its deadline counts from now. */
  private UalServiceBlockingStub within(long limitMs) {
    return UalServiceGrpc.newBlockingStub(channel).withDeadlineAfter(limitMs, TimeUnit.MILLISECONDS);
  }

  /** Returns UAL's reason, or nothing if the error comes from gRPC: no connection, a deadline, a cancellation. */
  private static Optional<ErrorInfo> errorInfo(Throwable error) {
    com.google.rpc.Status status = StatusProto.fromThrowable(error);
    if (status == null) {
      return Optional.empty();
    }
    return status.getDetailsList().stream()
        .filter(detail -> detail.is(ErrorInfo.class))
        .map(detail -> {
          try {
            return detail.unpack(ErrorInfo.class);
          } catch (InvalidProtocolBufferException malformed) {
            throw new IllegalStateException(malformed);
          }
        })
        .filter(info -> info.getDomain().equals("ual"))
        .findFirst();
  }

  private static String explain(Throwable thrown) {
    Throwable error = thrown instanceof ExecutionException && thrown.getCause() != null ? thrown.getCause() : thrown;
    return errorInfo(error)
        .map(info -> info.getReason() + ": " + Status.fromThrowable(error).getDescription())
        .orElseGet(error::toString);
  }

  private static String name(State state) {
    return state.name().replaceFirst("^STATE_", "");
  }

  private static void await(CountDownLatch latch) {
    try {
      latch.await(ANSWER_LIMIT_MS, TimeUnit.MILLISECONDS);
    } catch (InterruptedException interrupted) {
      Thread.currentThread().interrupt();
    }
  }
}
