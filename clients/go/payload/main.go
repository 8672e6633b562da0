// Payload moves what a UAV carries, through an extension of its daemon: the arm of the examples.
package main

import (
	"context"
	"flag"
	"fmt"
	"os"
	"time"

	"google.golang.org/grpc"
	"google.golang.org/grpc/credentials/insecure"

	armv1 "example.org/ual/mission/gen/ual_arm/v1"
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
	return moveArm(ctx, armv1.NewArmServiceClient(connection))
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
