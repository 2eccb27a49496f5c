"""The robots that ship with towline, one YAML file each, with their sources."""
