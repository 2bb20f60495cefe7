"""What no driving whatsoever can keep: proofs that limits are too narrow for a vehicle."""
