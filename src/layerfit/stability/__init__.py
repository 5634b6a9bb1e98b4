"""Numbers that hold: every structure at the corners of its ranges, in float32 beside float64."""
