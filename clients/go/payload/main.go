// Payload moves what a UAV carries, through two extensions of its daemon: the arm and the gimbal of the examples.
package main

import (
	"context"
	"flag"
	"fmt"
	"os"
	"time"

	"google.golang.org/grpc"
	"google.golang.org/grpc/credentials/insecure"
	"google.golang.org/protobuf/proto"

	armv1 "example.org/ual/mission/gen/ual_arm/v1"
	gimbalv1 "example.org/ual/mission/gen/ual_gimbal/v1"
)

const limit = 20 * time.Second // for all of it

func main() {
	address := flag.String("address", "127.0.0.1:50051", "`HOST:PORT` of the UAV's daemon")
	flag.Parse()
	ctx, cancel := context.WithTimeout(context.Background(), limit)
	defer cancel()
	if err := run(ctx, *address); err != nil {
		fmt.Fprintln(os.Stderr, "payload:", err)
		os.Exit(1)
	}
}

func run(ctx context.Context, address string) error {
	connection, err := grpc.NewClient(address, grpc.WithTransportCredentials(insecure.NewCredentials()))
	if err != nil {
		return err
	}
	defer connection.Close()
	if err := moveArm(ctx, armv1.NewArmServiceClient(connection)); err != nil {
		return err
	}
	return pointGimbal(ctx, gimbalv1.NewGimbalServiceClient(connection))
}

// moveArm moves both joints, and shows where they are then.
func moveArm(ctx context.Context, arm armv1.ArmServiceClient) error {
	moved, err := arm.MoveJoints(ctx, &armv1.MoveJointsRequest{ShoulderRad: 0.5, ElbowRad: -1.0})
	if err != nil {
		return err
	}
	joints := moved.GetJoints()
	fmt.Printf("arm at %.2f %.2f rad\n", joints.GetShoulderRad(), joints.GetElbowRad())
	return nil
}

// pointGimbal points down and to the left, and waits in the stream of attitudes until the gimbal says so.
func pointGimbal(ctx context.Context, gimbal gimbalv1.GimbalServiceClient) error {
	goal := &gimbalv1.Attitude{PitchRad: -0.5, YawRad: 0.3}
	if _, err := gimbal.Point(ctx, &gimbalv1.PointRequest{Attitude: goal}); err != nil {
		return err
	}
	watched, err := gimbal.WatchAttitude(ctx, &gimbalv1.WatchAttitudeRequest{RateHz: 20})
	if err != nil {
		return err
	}
	for {
		said, err := watched.Recv()
		if err != nil {
			return err
		}
		if attitude := said.GetAttitude(); proto.Equal(attitude, goal) {
			fmt.Printf("gimbal at %.2f %.2f rad\n", attitude.GetPitchRad(), attitude.GetYawRad())
			return nil
		}
	}
}
