"""Plans of friction measurements: runs at constant speed, poses, break-away tests."""
