"""Houses, apartment blocks and warehouses, and the facades and roofs they are built from."""
