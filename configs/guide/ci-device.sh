#!/bin/sh
# A device of your own, for docs/guide/tests-and-ci.md: it calls the PLC at the port $1, reports each second
# (bottle 1201: 500.5 ml, as filling.udt lies in an S7), and calls again after a loss.
while true; do
    while printf '\0\0\004\261\103\372\100\0\003\0\101\254\0\0\0\007\001\0'; do sleep 1; done |
        socat -u - "TCP:127.0.0.1:$1"
    sleep 0.5
done
