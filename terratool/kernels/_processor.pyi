"""Which variant of the kernels runs here."""

def is_v3() -> bool:
    """Whether the processor has x86-64-v3."""
