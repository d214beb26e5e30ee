"""What a robot may not do: limits, their exact extrema over time, and why they cannot all be met."""
