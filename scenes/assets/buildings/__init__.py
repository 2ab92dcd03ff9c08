"""Houses, apartment blocks and warehouses, and the parts they are built from."""
