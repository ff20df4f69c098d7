"""Reports from stored results only: one module per study, one look for all of them (`page`, `figures`)."""
