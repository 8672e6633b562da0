//! Flies a UAV through its UAL daemon: take-off, a waypoint, velocities, a refused request, landing.
//!
//! Ctrl-C drops the running call, which cancels it. The daemon then cancels a waypoint, and stops a UAV that
//! gets no more velocities; the UAV holds its position. A take-off or a landing continues.

#![allow(clippy::needless_update)] // the contract grows: `..Default::default()` is for future fields

use std::f64::consts::FRAC_PI_2;
use std::fmt;
use std::process::ExitCode;
use std::time::Duration;

use anyhow::{Context, Result, bail, ensure};
use clap::Parser;
use tokio::time::{interval, timeout};
use tokio_stream::StreamExt;
use tokio_stream::wrappers::IntervalStream;
use tonic::transport::{Channel, Endpoint};
use tonic::{Request, Status};
use tonic_types::{ErrorInfo, StatusExt};

use ual::stream_setpoints_request::Setpoint;
use ual::ual_service_client::UalServiceClient;
use ual::{
    GetInfoRequest, GoToWaypointRequest, Header, LandRequest, Pose, PoseStamped, Quaternion, RecoverFromManualRequest,
    State, StreamSetpointsRequest, StreamTelemetryRequest, TakeOffRequest, Telemetry, Twist, TwistStamped, Vector3,
};

#[allow(clippy::all)] // generated
mod ual {
    tonic::include_proto!("ual.v1");
}

type Uav = UalServiceClient<Channel>;

/// For calls that the daemon answers at once.
const ANSWER_LIMIT: Duration = Duration::from_secs(5);
/// For the safety pilot.
const ARM_LIMIT: Duration = Duration::from_secs(60);
const MANOEUVRE_LIMIT: Duration = Duration::from_secs(60);
/// The UAV stops after 0.5 s without a setpoint.
const SETPOINT_PERIOD: Duration = Duration::from_millis(50);
const SETPOINT_COUNT: u32 = 40;

/// Flies a small mission.
#[derive(Parser)]
struct Arguments {
    /// HOST:PORT of the UAV's daemon
    #[arg(long, default_value = "127.0.0.1:50051")]
    address: String,
}

#[tokio::main]
async fn main() -> ExitCode {
    let arguments = Arguments::parse();
    tokio::select! {
        result = run(&arguments.address) => match result {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => {
                eprintln!("mission: {error:#}");
                ExitCode::FAILURE
            }
        },
        _ = tokio::signal::ctrl_c() => {
            eprintln!("interrupted: the UAV holds its position (a take-off or landing goes on)");
            ExitCode::from(130)
        }
    }
}

async fn run(address: &str) -> Result<()> {
    let channel = Endpoint::from_shared(format!("http://{address}"))?
        .connect_timeout(ANSWER_LIMIT)
        .connect()
        .await
        .with_context(|| format!("no daemon at {address}"))?;
    let mut uav = UalServiceClient::new(channel);

    let info = uav
        .get_info(within(ANSWER_LIMIT, GetInfoRequest::default()))
        .await
        .map_err(explain)
        .context("info")?
        .into_inner();
    println!("{}: backend {}, UAL {}", info.namespace, info.backend, info.ual_version);
    timeout(ARM_LIMIT, wait_until_armed(&mut uav)).await.context("the safety pilot did not arm")??;

    // Telemetry does not end by itself: when the flight ends, dropping `watch` ends its stream.
    let mut watcher = uav.clone();
    tokio::select! {
        flown = fly(&mut uav, &info.namespace) => flown?,
        failed = watch(&mut watcher) => failed.context("telemetry")?,
    }
    println!("done");
    Ok(())
}

async fn fly(uav: &mut Uav, ns: &str) -> Result<()> {
    take_off(uav, 3.0).await.map_err(explain).context("take-off")?;
    go_to(uav, [4.0, 2.0, 3.0], FRAC_PI_2).await.map_err(explain).context("waypoint")?;
    stream_velocities(uav, ns).await.context("velocities")?;
    show_refusal(uav).await.context("recover")?;
    land(uav).await.context("landing")
}

async fn wait_until_armed(uav: &mut Uav) -> Result<()> {
    let request = StreamTelemetryRequest { rate_hz: 10.0, ..Default::default() };
    let mut samples = uav.stream_telemetry(request).await.map_err(explain)?.into_inner();
    let mut shown = State::Unspecified;
    while let Some(sample) = samples.message().await.map_err(explain)? {
        let state = sample.telemetry.unwrap_or_default().state();
        if state == State::LandedArmed {
            return Ok(());
        }
        if state != shown {
            println!("{}: waiting for the safety pilot to arm", name(state));
            shown = state;
        }
    }
    bail!("the daemon ended the telemetry before the UAV was armed")
}

/// Prints the position of the UAV. Returns only when the telemetry ends.
async fn watch(uav: &mut Uav) -> Result<()> {
    let request = StreamTelemetryRequest { rate_hz: 2.0, ..Default::default() };
    let mut samples = uav.stream_telemetry(request).await.map_err(explain)?.into_inner();
    while let Some(sample) = samples.message().await.map_err(explain)? {
        println!("  {}", Shown(&sample.telemetry.unwrap_or_default()));
    }
    bail!("the daemon ended the telemetry")
}

struct Shown<'a>(&'a Telemetry);

impl fmt::Display for Shown<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", name(self.0.state()))?;
        match self.0.pose.and_then(|pose| pose.position) {
            Some(Vector3 { x, y, z }) => write!(f, " at {x:.1} {y:.1} {z:.1} m"),
            None => write!(f, " at an unknown position"),
        }
    }
}

async fn take_off(uav: &mut Uav, height_m: f64) -> Result<(), Status> {
    println!("take-off to {height_m} m");
    let request = TakeOffRequest { height_m, ..Default::default() };
    uav.take_off(within(MANOEUVRE_LIMIT, request)).await?;
    Ok(())
}

/// Flies to a position (m) and heading in the frame <ns>/odom. If this future is dropped early, the UAV holds.
async fn go_to(uav: &mut Uav, [x, y, z]: [f64; 3], yaw_rad: f64) -> Result<(), Status> {
    println!("waypoint {x} {y} {z} m, heading {yaw_rad:.2} rad");
    let (sine, cosine) = (yaw_rad / 2.0).sin_cos();
    let pose = Pose {
        position: Some(Vector3 { x, y, z }),
        orientation: Some(Quaternion { z: sine, w: cosine, ..Default::default() }),
    };
    let request = GoToWaypointRequest {
        waypoint: Some(PoseStamped { pose: Some(pose), ..Default::default() }),
        ..Default::default()
    };
    uav.go_to_waypoint(within(MANOEUVRE_LIMIT, request)).await?;
    Ok(())
}

/// Flies forward at 0.5 m/s for SETPOINT_COUNT periods.
async fn stream_velocities(uav: &mut Uav, ns: &str) -> Result<()> {
    println!("0.5 m/s forward for 2 s");
    let setpoint = StreamSetpointsRequest {
        setpoint: Some(Setpoint::Velocity(TwistStamped {
            header: Some(Header { frame_id: format!("{ns}/base_link"), ..Default::default() }),
            twist: Some(Twist { linear: Some(Vector3 { x: 0.5, ..Default::default() }), ..Default::default() }),
        })),
    };
    let setpoints =
        IntervalStream::new(interval(SETPOINT_PERIOD)).take(SETPOINT_COUNT as usize).map(move |_| setpoint.clone());
    let limit = SETPOINT_COUNT * SETPOINT_PERIOD + ANSWER_LIMIT;
    let response = uav.stream_setpoints(within(limit, setpoints)).await.map_err(explain)?.into_inner();
    let accepted = response.accepted_count;
    ensure!(accepted == u64::from(SETPOINT_COUNT), "{accepted} of {SETPOINT_COUNT} setpoints were accepted");
    Ok(())
}

/// Sends a command that is not allowed in FLYING_AUTO and reads the reason of the refusal.
async fn show_refusal(uav: &mut Uav) -> Result<()> {
    let request = within(ANSWER_LIMIT, RecoverFromManualRequest::default());
    let Err(status) = uav.recover_from_manual(request).await else {
        bail!("was not refused in FLYING_AUTO");
    };
    match error_info(&status) {
        Some(ErrorInfo { reason, metadata, .. }) if reason == "WRONG_STATE" => {
            let state = metadata.get("state").map_or("not told", String::as_str);
            println!("recover is refused: {reason} (state {state}): {}", status.message());
            Ok(())
        }
        _ => Err(explain(status)),
    }
}

async fn land(uav: &mut Uav) -> Result<()> {
    println!("landing");
    uav.land(within(MANOEUVRE_LIMIT, LandRequest::default())).await.map_err(explain)?;
    Ok(())
}

/// Returns a request with a deadline, which gRPC also sends to the daemon.
fn within<T>(limit: Duration, message: T) -> Request<T> {
    let mut request = Request::new(message);
    request.set_timeout(limit);
    request
}

/// Returns UAL's reason, or `None` if the error comes from gRPC: no connection, a deadline, a cancellation.
fn error_info(status: &Status) -> Option<ErrorInfo> {
    status.get_details_error_info().filter(|info| info.domain == "ual")
}

/// Describes the failure, with UAL's reason if there is one.
fn explain(status: Status) -> anyhow::Error {
    match error_info(&status) {
        Some(info) => anyhow::anyhow!("{}: {}", info.reason, status.message()),
        None => status.into(),
    }
}

fn name(state: State) -> &'static str {
    state.as_str_name().trim_start_matches("STATE_")
}
