"""The ways to serve gRPC: on its core (`core`), or on the public ``grpc.aio`` (`aio`). Both are a `base.Transport`."""
