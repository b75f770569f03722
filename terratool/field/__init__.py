"""What a definition means: compiled once into flat arrays, asked by everything else."""
