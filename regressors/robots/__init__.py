"""Built-in robot descriptions, one YAML file each; `regressors.library` reads them."""
