"""What has come and gone: received bytes, frames, counters, waveforms."""
