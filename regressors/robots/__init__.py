"""Built-in robot descriptions, one YAML file each; `regressors.readers.library` reads them."""
