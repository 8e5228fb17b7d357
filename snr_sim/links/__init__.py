"""Links: how pages get from one node to another."""
