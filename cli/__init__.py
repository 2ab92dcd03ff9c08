"""The echoscape command, one file a subcommand."""
