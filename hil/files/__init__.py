"""Reading and writing files: YAML models with line numbers, CSV columns, output folders."""
