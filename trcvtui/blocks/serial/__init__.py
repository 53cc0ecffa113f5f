"""The blocks of Tc2_SerialCom: frames, bytes and texts over a ComBuffer (TwinCAT TF6340 help)."""
