"""From sampled positions to position, velocity and acceleration, and the filters that go with them."""
