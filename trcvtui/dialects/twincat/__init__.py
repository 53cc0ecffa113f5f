"""Beckhoff TwinCAT, Tc2_SerialCom: its rules and its error table."""
