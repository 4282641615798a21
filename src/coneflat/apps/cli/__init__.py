"""The `coneflat` command, with one module per subcommand."""
