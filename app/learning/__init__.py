"""The learners: QMIX from scratch, QMIX by transfer, DQN over joint actions, and the trained library.

Importing this package or :mod:`app.learning.parameters` does not load torch. ``README.md`` beside this file
says where to begin; what differs from the paper, and what it leaves open, is listed in ``ALGORITHMS.md``.
"""
