"""The blocks of Tc2_SerialCom: frames, bytes and texts over a ComBuffer (receivedata.md 2)."""
