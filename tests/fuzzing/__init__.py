"""Bad and hostile input, made by machine: what is tried is in `targets`, how it is judged in `judge`."""
