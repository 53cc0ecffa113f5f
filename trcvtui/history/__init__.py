"""The past of a bench: received bytes, frames, counters, waveforms."""
