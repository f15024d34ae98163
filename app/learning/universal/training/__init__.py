"""How the shipped policies for every size are made: demonstrations, training, production."""
