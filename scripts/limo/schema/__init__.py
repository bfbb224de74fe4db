"""What a file may say: plain data types with units and ranges; nothing is read or checked across files."""
