"""Robot descriptions, and regressor models that are linear in the dynamic parameters."""
