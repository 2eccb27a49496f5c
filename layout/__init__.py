"""Layouts of robots that meet requirements: anchors, attachments and tension limits with the largest margin."""

from .requirements import Free, Requirement, Requirements, read_requirements
from .result import Design
from .run import design

__all__ = ["Design", "Free", "Requirement", "Requirements", "design", "read_requirements"]
