"""What the documentation's site is made with, besides its pages: the commands, and a check of links."""
