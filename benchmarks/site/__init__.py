"""What the documentation's site is made with, besides its pages."""
