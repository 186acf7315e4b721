"""What every room uses: errors, checks of what users pass, files, commands, child processes."""
