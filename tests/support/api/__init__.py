"""What the tests of REST share: its operations, measurements as vehicles post them, a line that can be cut."""
