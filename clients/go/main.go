// Mission flies a UAV through its UAL daemon: take-off, a waypoint, velocities, a refused request, landing.
//
// Ctrl-C cancels the running call. The daemon then cancels a waypoint, and stops a UAV that gets no more
// velocities; the UAV holds its position. A take-off or a landing continues.
package main

import (
	"context"
	"errors"
	"flag"
	"fmt"
	"io"
	"math"
	"os"
	"os/signal"
	"strings"
	"syscall"
	"time"

	"google.golang.org/genproto/googleapis/rpc/errdetails"
	"google.golang.org/grpc"
	"google.golang.org/grpc/codes"
	"google.golang.org/grpc/credentials"
	"google.golang.org/grpc/credentials/insecure"
	"google.golang.org/grpc/metadata"
	"google.golang.org/grpc/status"

	ualv1 "example.org/ual/mission/gen/ual/v1"
)

//go:generate buf generate ../.. --config buf.workspace.yaml

const (
	answerLimit    = 5 * time.Second // for calls that the daemon answers at once
	armLimit       = time.Minute     // for the safety pilot
	manoeuvreLimit = time.Minute
	leasePeriod    = 500 * time.Millisecond // a lease ends 2 s after it was kept last
	setpointPeriod = 50 * time.Millisecond  // the UAV stops after 0.5 s without a setpoint
	setpointCount  = 40
)

func main() {
	address := flag.String("address", "127.0.0.1:50051", "`HOST:PORT` of the UAV's daemon")
	tlsCA := flag.String("tls-ca", "", "`FILE` with the certificates to trust, for a daemon that uses TLS")
	tokenFile := flag.String("token-file", "", "`FILE` with a token, for a daemon that wants to know who calls")
	withLease := flag.Bool("lease", false, "let nobody else fly it meanwhile")
	flag.Parse()
	ctx, stop := signal.NotifyContext(context.Background(), os.Interrupt, syscall.SIGTERM)
	defer stop()

	err := run(ctx, *address, *tlsCA, *tokenFile, *withLease)
	switch {
	case ctx.Err() != nil:
		fmt.Fprintln(os.Stderr, "interrupted: the UAV holds its position (a take-off or landing goes on)")
		os.Exit(130)
	case err != nil:
		fmt.Fprintln(os.Stderr, "mission:", err)
		os.Exit(1)
	}
}

func run(ctx context.Context, address, tlsCA, tokenFile string, withLease bool) error {
	options, err := dialOptions(tlsCA, tokenFile)
	if err != nil {
		return err
	}
	connection, err := grpc.NewClient(address, options...)
	if err != nil {
		return err
	}
	defer connection.Close()
	uav := ualv1.NewUalServiceClient(connection)
	if withLease {
		held, release, err := acquireLease(ctx, uav)
		if err != nil {
			return explain("lease", err)
		}
		defer release()
		ctx = held
	}

	ns, err := showInfo(ctx, uav)
	if err != nil {
		return explain("info", err)
	}
	if err := waitUntilArmed(ctx, uav); err != nil {
		return explain("waiting for the safety pilot", err)
	}

	watchCtx, stopWatching := context.WithCancel(ctx)
	defer stopWatching()
	watched := make(chan error, 1)
	go func() { watched <- watch(watchCtx, uav) }()

	if err := fly(ctx, uav, ns); err != nil {
		return err
	}
	stopWatching()
	if err := <-watched; err != nil {
		return explain("telemetry", err)
	}
	fmt.Println("done")
	return nil
}

// dialOptions returns how to connect: with TLS where there are certificates to trust, with a token where there is one.
func dialOptions(tlsCA, tokenFile string) ([]grpc.DialOption, error) {
	transport := insecure.NewCredentials()
	if tlsCA != "" {
		trusted, err := credentials.NewClientTLSFromFile(tlsCA, "")
		if err != nil {
			return nil, err
		}
		transport = trusted
	}
	options := []grpc.DialOption{grpc.WithTransportCredentials(transport)}
	if tokenFile == "" {
		return options, nil
	}
	secret, err := os.ReadFile(tokenFile)
	if err != nil {
		return nil, err
	}
	return append(options, grpc.WithPerRPCCredentials(token(strings.TrimSpace(string(secret))))), nil
}

// token shows the daemon who calls. gRPC sends it only by TLS.
type token string

func (t token) GetRequestMetadata(context.Context, ...string) (map[string]string, error) {
	return map[string]string{"authorization": "Bearer " + string(t)}, nil
}

func (token) RequireTransportSecurity() bool { return true }

// acquireLease makes this program the only one that flies the UAV, until release. Calls with the context that it
// returns carry the lease; the context ends when the lease is lost.
func acquireLease(ctx context.Context, uav ualv1.UalServiceClient) (held context.Context, release func(), err error) {
	acquired, err := uav.AcquireLease(ctx, &ualv1.AcquireLeaseRequest{Holder: "go mission"})
	if err != nil {
		return nil, nil, err
	}
	id := acquired.GetLeaseId()
	fmt.Println("holds the lease")
	held, cancel := context.WithCancel(metadata.AppendToOutgoingContext(ctx, "ual-lease", id))
	go keepLease(held, cancel, uav, id)
	return held, func() {
		cancel()
		last, done := context.WithTimeout(context.Background(), answerLimit)
		defer done()
		if _, err := uav.ReleaseLease(last, &ualv1.ReleaseLeaseRequest{LeaseId: id}); err != nil {
			fmt.Fprintln(os.Stderr, explain("the lease was not released, it ends by itself", err))
		}
	}, nil
}

// keepLease keeps a lease until ctx ends, and cancels ctx when the lease is lost.
func keepLease(ctx context.Context, lost context.CancelFunc, uav ualv1.UalServiceClient, id string) {
	for {
		select {
		case <-ctx.Done():
			return
		case <-time.After(leasePeriod):
		}
		_, err := uav.KeepLease(ctx, &ualv1.KeepLeaseRequest{LeaseId: id})
		if errorInfo(err).GetReason() == "LEASE_LOST" {
			fmt.Fprintln(os.Stderr, explain("lease", err))
			lost()
		}
	}
}

func fly(ctx context.Context, uav ualv1.UalServiceClient, ns string) error {
	if err := takeOff(ctx, uav, 3); err != nil {
		return explain("take-off", err)
	}
	if err := goTo(ctx, uav, 4, 2, 3, math.Pi/2); err != nil {
		return explain("waypoint", err)
	}
	if err := streamVelocities(ctx, uav, ns); err != nil {
		return explain("velocities", err)
	}
	if err := showRefusal(ctx, uav); err != nil {
		return err
	}
	if err := land(ctx, uav); err != nil {
		return explain("landing", err)
	}
	return nil
}

func showInfo(ctx context.Context, uav ualv1.UalServiceClient) (ns string, err error) {
	ctx, cancel := context.WithTimeout(ctx, answerLimit)
	defer cancel()
	info, err := uav.GetInfo(ctx, &ualv1.GetInfoRequest{})
	if err != nil {
		return "", err
	}
	fmt.Printf("%s: backend %s, UAL %s\n", info.GetNamespace(), info.GetBackend(), info.GetUalVersion())
	return info.GetNamespace(), nil
}

func waitUntilArmed(ctx context.Context, uav ualv1.UalServiceClient) error {
	ctx, cancel := context.WithTimeout(ctx, armLimit)
	defer cancel()
	stream, err := uav.StreamTelemetry(ctx, &ualv1.StreamTelemetryRequest{RateHz: 10})
	if err != nil {
		return err
	}
	shown := ualv1.State_STATE_UNSPECIFIED
	for {
		sample, err := stream.Recv()
		if err != nil {
			return err
		}
		state := sample.GetTelemetry().GetState()
		if state == ualv1.State_STATE_LANDED_ARMED {
			return nil
		}
		if state != shown {
			fmt.Printf("%s: waiting for the safety pilot to arm\n", name(state))
			shown = state
		}
	}
}

// watch prints the position of the UAV until ctx is cancelled.
func watch(ctx context.Context, uav ualv1.UalServiceClient) error {
	stream, err := uav.StreamTelemetry(ctx, &ualv1.StreamTelemetryRequest{RateHz: 2})
	if err != nil {
		return err
	}
	for {
		sample, err := stream.Recv()
		if status.Code(err) == codes.Canceled {
			return nil
		}
		if err != nil {
			return err
		}
		telemetry := sample.GetTelemetry()
		position := telemetry.GetPose().GetPosition()
		fmt.Printf("  %s at %.1f %.1f %.1f m\n",
			name(telemetry.GetState()), position.GetX(), position.GetY(), position.GetZ())
	}
}

func takeOff(ctx context.Context, uav ualv1.UalServiceClient, heightM float64) error {
	fmt.Printf("take-off to %g m\n", heightM)
	ctx, cancel := context.WithTimeout(ctx, manoeuvreLimit)
	defer cancel()
	_, err := uav.TakeOff(ctx, &ualv1.TakeOffRequest{HeightM: heightM})
	return err
}

// goTo flies to a position (m) and heading in the frame <ns>/odom. If ctx ends early, the UAV holds its position.
func goTo(ctx context.Context, uav ualv1.UalServiceClient, x, y, z, yawRad float64) error {
	fmt.Printf("waypoint %g %g %g m, heading %.2f rad\n", x, y, z, yawRad)
	ctx, cancel := context.WithTimeout(ctx, manoeuvreLimit)
	defer cancel()
	pose := &ualv1.Pose{
		Position:    &ualv1.Vector3{X: x, Y: y, Z: z},
		Orientation: &ualv1.Quaternion{Z: math.Sin(yawRad / 2), W: math.Cos(yawRad / 2)},
	}
	_, err := uav.GoToWaypoint(ctx, &ualv1.GoToWaypointRequest{Waypoint: &ualv1.PoseStamped{Pose: pose}})
	return err
}

// streamVelocities flies forward at 0.5 m/s for setpointCount periods.
func streamVelocities(ctx context.Context, uav ualv1.UalServiceClient, ns string) error {
	fmt.Println("0.5 m/s forward for 2 s")
	ctx, cancel := context.WithTimeout(ctx, setpointCount*setpointPeriod+answerLimit)
	defer cancel()
	stream, err := uav.StreamSetpoints(ctx)
	if err != nil {
		return err
	}
	setpoint := &ualv1.StreamSetpointsRequest{Setpoint: &ualv1.StreamSetpointsRequest_Velocity{
		Velocity: &ualv1.TwistStamped{
			Header: &ualv1.Header{FrameId: ns + "/base_link"},
			Twist:  &ualv1.Twist{Linear: &ualv1.Vector3{X: 0.5}},
		},
	}}
	ticker := time.NewTicker(setpointPeriod)
	defer ticker.Stop()
	for range setpointCount {
		if err := stream.Send(setpoint); errors.Is(err, io.EOF) {
			break // the daemon has ended the stream; CloseAndRecv returns the reason
		} else if err != nil {
			return err
		}
		select {
		case <-ticker.C:
		case <-ctx.Done():
		}
	}
	response, err := stream.CloseAndRecv()
	if err != nil {
		return err
	}
	if response.GetAcceptedCount() != setpointCount {
		return fmt.Errorf("%d of %d setpoints were accepted", response.GetAcceptedCount(), setpointCount)
	}
	return nil
}

// showRefusal sends a command that is not allowed in FLYING_AUTO and reads the reason of the refusal.
func showRefusal(ctx context.Context, uav ualv1.UalServiceClient) error {
	ctx, cancel := context.WithTimeout(ctx, answerLimit)
	defer cancel()
	_, err := uav.RecoverFromManual(ctx, &ualv1.RecoverFromManualRequest{})
	if err == nil {
		return errors.New("recover was not refused in FLYING_AUTO")
	}
	info := errorInfo(err)
	if info.GetReason() != "WRONG_STATE" {
		return explain("recover", err)
	}
	fmt.Printf("recover is refused: %s (state %s): %s\n",
		info.GetReason(), info.GetMetadata()["state"], status.Convert(err).Message())
	return nil
}

func land(ctx context.Context, uav ualv1.UalServiceClient) error {
	fmt.Println("landing")
	ctx, cancel := context.WithTimeout(ctx, manoeuvreLimit)
	defer cancel()
	_, err := uav.Land(ctx, &ualv1.LandRequest{})
	return err
}

// errorInfo returns UAL's reason, or nil if the error comes from gRPC: no connection, a deadline, a cancellation.
func errorInfo(err error) *errdetails.ErrorInfo {
	for _, detail := range status.Convert(err).Details() {
		if info, ok := detail.(*errdetails.ErrorInfo); ok && info.GetDomain() == "ual" {
			return info
		}
	}
	return nil
}

// explain describes the failure, with UAL's reason if there is one.
func explain(what string, err error) error {
	if info := errorInfo(err); info != nil {
		return fmt.Errorf("%s: %s: %s", what, info.GetReason(), status.Convert(err).Message())
	}
	return fmt.Errorf("%s: %w", what, err)
}

func name(state ualv1.State) string {
	return strings.TrimPrefix(state.String(), "STATE_")
}
