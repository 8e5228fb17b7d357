"""Parts any robot can use: filters, timers, printers, and the links between nodes."""
