"""The guard of the speed: ratios of processor time within one run, against those that were recorded last.

It needs no other program than UAL: what stands below a ratio is the same without UAL, packed by pymavlink or served by
gRPC alone. Processor time depends little on what else runs on the computer, and of several tries the least counts.
"""
