"""What several jobs share: command lines, reports, encounters, starting designs."""
