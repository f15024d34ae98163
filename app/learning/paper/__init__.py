"""The paper's learners: Algorithm 1 and the DQN of section 4.1, with what they learn from."""
