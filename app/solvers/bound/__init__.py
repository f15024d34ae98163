"""Upper bounds on the reward of any plan; README.md beside this file has the proof."""
