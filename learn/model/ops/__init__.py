"""Operations whose PyTorch forms are slow on the CPU, each tested against the plain form."""
