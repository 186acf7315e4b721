"""How often experts of tasks for several robots succeed, in their own layouts and in others."""
