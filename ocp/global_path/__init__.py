"""Global paths: past which side of obstacles a motion goes, searched before any program is solved."""
