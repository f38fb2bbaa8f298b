"""Training of a network for people at close range: samples, network, training, export."""
