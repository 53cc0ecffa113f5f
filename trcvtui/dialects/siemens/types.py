"""The system types of Siemens that a program declares variables of: TDiag_Status (siemens.md 2.6)."""

from __future__ import annotations

from typing import Final

# Words and numbers of State and Kind are the help's; the order of the fields is that of T_DIAG's table.
TDIAG_STATUS: Final = """
TYPE TDiag_State : (Down := 1, ActiveTrying := 2, PassiveWaiting := 3, Established := 4, Closing := 5) USINT;
END_TYPE
TYPE TDiag_Kind : (Configured := 1, Programmed := 3) USINT; END_TYPE
TYPE TDiag_Status :
STRUCT
    InterfaceId : UINT; // HW_ANY
    ID : UINT; // CONN_OUC
    ConnectionType : BYTE; // 16#0B, 16#11 TCP; 16#0C, 16#12 ISO-on-TCP; 16#13 UDP
    ActiveEstablished : BOOL;
    State : TDiag_State;
    Kind : TDiag_Kind;
    SentBytes : UDINT;
    ReceivedBytes : UDINT;
END_STRUCT
END_TYPE
"""
