"""What tests of tracking errors drive."""

from tests.report.conftest import straight as straight  # noqa: PLC0414 - a fixture, for the tests here
