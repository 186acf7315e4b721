"""Where recorded actions come from: experts, policies, people, and several of them in turn."""
