"""What no driving can do: proofs that a vehicle cannot pass a road, by bounds of everything that it can reach."""
