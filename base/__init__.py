"""What every package stands on: errors, input checks, text, files, workers, version. It knows no robot."""
