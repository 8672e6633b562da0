// Flies a UAV through its UAL daemon: take-off, a waypoint, velocities, a refused request, landing.
//
// Ctrl-C cancels the running calls. The daemon then cancels a waypoint, and stops a UAV that gets no more
// velocities; the UAV holds its position. A take-off or a landing continues.

#include <google/rpc/error_details.pb.h>
#include <google/rpc/status.pb.h>
#include <grpcpp/grpcpp.h>
#include <signal.h>
#include <ual/v1/ual.grpc.pb.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <future>
#include <memory>
#include <mutex>
#include <numbers>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>

namespace {

using namespace std::chrono_literals;
using std::chrono::milliseconds;
using std::chrono::system_clock;
using ual::v1::UalService;

constexpr auto kAnswerLimit = 5s;  // for calls that the daemon answers at once
constexpr auto kArmLimit = 60s;    // for the safety pilot
constexpr auto kManoeuvreLimit = 60s;
constexpr auto kSetpointPeriod = 50ms;  // the UAV stops after 0.5 s without a setpoint
constexpr int kSetpointCount = 40;

// The running calls, so that Ctrl-C can cancel them.
class Calls {
 public:
  void Add(grpc::ClientContext* call) {
    const std::lock_guard lock(mutex_);
    running_.insert(call);
    if (are_cancelled_) call->TryCancel();
  }

  void Remove(grpc::ClientContext* call) {
    const std::lock_guard lock(mutex_);
    running_.erase(call);
  }

  // Cancels the running calls and all later ones.
  void CancelAll() {
    const std::lock_guard lock(mutex_);
    are_cancelled_ = true;
    for (grpc::ClientContext* call : running_) call->TryCancel();
  }

  bool are_cancelled() const {
    const std::lock_guard lock(mutex_);
    return are_cancelled_;
  }

 private:
  mutable std::mutex mutex_;
  std::set<grpc::ClientContext*> running_;
  bool are_cancelled_ = false;
};

// The context of one call, which Ctrl-C cancels.
class Call {
 public:
  explicit Call(Calls& calls) : calls_(calls) { calls_.Add(&context_); }
  Call(Calls& calls, milliseconds limit) : Call(calls) { context_.set_deadline(system_clock::now() + limit); }
  ~Call() { calls_.Remove(&context_); }
  Call(const Call&) = delete;
  Call& operator=(const Call&) = delete;

  grpc::ClientContext* context() { return &context_; }
  void Cancel() { context_.TryCancel(); }

 private:
  Calls& calls_;
  grpc::ClientContext context_;
};

// Returns UAL's reason, or nothing if the error comes from gRPC: no connection, a deadline, a cancellation.
std::optional<google::rpc::ErrorInfo> ErrorInfoOf(const grpc::Status& status) {
  google::rpc::Status details;
  if (!details.ParseFromString(status.error_details())) return std::nullopt;
  for (const auto& detail : details.details()) {
    google::rpc::ErrorInfo info;
    if (detail.UnpackTo(&info) && info.domain() == "ual") return info;
  }
  return std::nullopt;
}

class Failure : public std::runtime_error {
 public:
  Failure(const std::string& what, const grpc::Status& status) : std::runtime_error(Explain(what, status)) {}

 private:
  static std::string Explain(const std::string& what, const grpc::Status& status) {
    const auto info = ErrorInfoOf(status);
    const std::string reason = info ? info->reason() : "gRPC status " + std::to_string(status.error_code());
    return what + ": " + reason + ": " + status.error_message();
  }
};

void Check(const std::string& what, const grpc::Status& status) {
  if (!status.ok()) throw Failure(what, status);
}

std::string Name(ual::v1::State state) {
  return ual::v1::State_Name(state).substr(std::strlen("STATE_"));
}

class Mission {
 public:
  Mission(const std::string& address, Calls& calls)
      : calls_(calls), uav_(UalService::NewStub(grpc::CreateChannel(address, grpc::InsecureChannelCredentials()))) {}

  void Run() {
    const std::string ns = ShowInfo();
    WaitUntilArmed();

    Call watching(calls_);
    auto watched = std::async(std::launch::async, [&] { Watch(watching); });
    try {
      TakeOff(3.0);
      GoTo(4.0, 2.0, 3.0, std::numbers::pi / 2.0);
      StreamVelocities(ns);
      ShowRefusal();
      Land();
    } catch (...) {
      watching.Cancel();  // otherwise `watched` would wait forever: telemetry does not end by itself
      throw;
    }
    watching.Cancel();
    watched.get();
    std::puts("done");
  }

 private:
  std::string ShowInfo() {
    Call call(calls_, kAnswerLimit);
    ual::v1::GetInfoResponse info;
    Check("info", uav_->GetInfo(call.context(), {}, &info));
    std::printf("%s: backend %s, UAL %s\n", info.namespace_().c_str(), info.backend().c_str(),
                info.ual_version().c_str());
    return info.namespace_();
  }

  void WaitUntilArmed() {
    Call call(calls_, kArmLimit);
    ual::v1::StreamTelemetryRequest request;
    request.set_rate_hz(10.0);
    const auto stream = uav_->StreamTelemetry(call.context(), request);
    ual::v1::StreamTelemetryResponse sample;
    auto shown = ual::v1::STATE_UNSPECIFIED;
    while (stream->Read(&sample)) {
      const auto state = sample.telemetry().state();
      if (state == ual::v1::STATE_LANDED_ARMED) {
        call.Cancel();
        stream->Finish();  // reports that it was cancelled
        return;
      }
      if (state != shown) {
        std::printf("%s: waiting for the safety pilot to arm\n", Name(state).c_str());
        shown = state;
      }
    }
    throw Failure("waiting for the safety pilot", stream->Finish());
  }

  // Prints the position of the UAV until the call is cancelled.
  void Watch(Call& call) {
    ual::v1::StreamTelemetryRequest request;
    request.set_rate_hz(2.0);
    const auto stream = uav_->StreamTelemetry(call.context(), request);
    ual::v1::StreamTelemetryResponse sample;
    while (stream->Read(&sample)) {
      const auto& position = sample.telemetry().pose().position();
      std::printf("  %s at %.1f %.1f %.1f m\n", Name(sample.telemetry().state()).c_str(), position.x(), position.y(),
                  position.z());
    }
    const grpc::Status status = stream->Finish();
    if (status.error_code() != grpc::StatusCode::CANCELLED) throw Failure("telemetry", status);
  }

  void TakeOff(double height_m) {
    std::printf("take-off to %g m\n", height_m);
    Call call(calls_, kManoeuvreLimit);
    ual::v1::TakeOffRequest request;
    request.set_height_m(height_m);
    ual::v1::TakeOffResponse response;
    Check("take-off", uav_->TakeOff(call.context(), request, &response));
  }

  // Flies to a position (m) and heading in the frame <ns>/odom. If the call ends early, the UAV holds.
  void GoTo(double x, double y, double z, double yaw_rad) {
    std::printf("waypoint %g %g %g m, heading %.2f rad\n", x, y, z, yaw_rad);
    Call call(calls_, kManoeuvreLimit);
    ual::v1::GoToWaypointRequest request;
    auto& pose = *request.mutable_waypoint()->mutable_pose();
    pose.mutable_position()->set_x(x);
    pose.mutable_position()->set_y(y);
    pose.mutable_position()->set_z(z);
    pose.mutable_orientation()->set_z(std::sin(yaw_rad / 2.0));
    pose.mutable_orientation()->set_w(std::cos(yaw_rad / 2.0));
    ual::v1::GoToWaypointResponse response;
    Check("waypoint", uav_->GoToWaypoint(call.context(), request, &response));
  }

  // Flies forward at 0.5 m/s for kSetpointCount periods.
  void StreamVelocities(const std::string& ns) {
    std::puts("0.5 m/s forward for 2 s");
    Call call(calls_, kSetpointCount * kSetpointPeriod + kAnswerLimit);
    ual::v1::StreamSetpointsRequest setpoint;
    setpoint.mutable_velocity()->mutable_header()->set_frame_id(ns + "/base_link");
    setpoint.mutable_velocity()->mutable_twist()->mutable_linear()->set_x(0.5);
    ual::v1::StreamSetpointsResponse response;
    const auto stream = uav_->StreamSetpoints(call.context(), &response);
    auto next = std::chrono::steady_clock::now();
    for (int sent = 0; sent < kSetpointCount; ++sent) {
      if (!stream->Write(setpoint)) break;  // the daemon has ended the stream; Finish returns the reason
      next += kSetpointPeriod;
      std::this_thread::sleep_until(next);
    }
    stream->WritesDone();
    Check("velocities", stream->Finish());
    if (response.accepted_count() != kSetpointCount) {
      throw std::runtime_error(std::to_string(response.accepted_count()) + " of " + std::to_string(kSetpointCount) +
                               " setpoints were accepted");
    }
  }

  // Sends a command that is not allowed in FLYING_AUTO and reads the reason of the refusal.
  void ShowRefusal() {
    Call call(calls_, kAnswerLimit);
    ual::v1::RecoverFromManualResponse response;
    const grpc::Status status = uav_->RecoverFromManual(call.context(), {}, &response);
    if (status.ok()) throw std::runtime_error("recover was not refused in FLYING_AUTO");
    const auto info = ErrorInfoOf(status);
    if (!info || info->reason() != "WRONG_STATE") throw Failure("recover", status);
    const auto state = info->metadata().find("state");
    std::printf("recover is refused: %s (state %s): %s\n", info->reason().c_str(),
                state == info->metadata().end() ? "not told" : state->second.c_str(), status.error_message().c_str());
  }

  void Land() {
    std::puts("landing");
    Call call(calls_, kManoeuvreLimit);
    ual::v1::LandResponse response;
    Check("landing", uav_->Land(call.context(), {}, &response));
  }

  Calls& calls_;
  std::unique_ptr<UalService::Stub> uav_;
};

}  // namespace

int main(int argc, char** argv) {
  std::string address = "127.0.0.1:50051";
  if (argc == 3 && std::strcmp(argv[1], "--address") == 0) {
    address = argv[2];
  } else if (argc != 1) {
    std::fputs("usage: mission [--address HOST:PORT]\n", stderr);
    return 2;
  }
  std::setvbuf(stdout, nullptr, _IOLBF, 0);

  // One thread waits for signals that are blocked in all threads: a signal handler must not call gRPC.
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  Calls calls;
  std::atomic<bool> has_ended = false;
  std::jthread interrupt([&] {
    int signal = 0;
    sigwait(&signals, &signal);
    if (!has_ended) calls.CancelAll();
  });

  int exit_status = EXIT_SUCCESS;
  try {
    Mission(address, calls).Run();
  } catch (const std::exception& error) {
    if (calls.are_cancelled()) {
      std::fputs("interrupted: the UAV holds its position (a take-off or landing goes on)\n", stderr);
      exit_status = 130;
    } else {
      std::fprintf(stderr, "mission: %s\n", error.what());
      exit_status = EXIT_FAILURE;
    }
  }
  has_ended = true;
  pthread_kill(interrupt.native_handle(), SIGTERM);  // it may still be waiting
  return exit_status;
}
