"""Networks of other trainers, in ONNX: from an observation to targets of joints."""
