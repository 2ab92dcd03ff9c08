"""From echoes to 8-bit codes: IF signal, front end, range FFT, quantiser."""
