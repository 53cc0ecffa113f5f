#!/bin/sh
# Makes the certificates that the scenarios in this folder name: make_certificates.sh [FOLDER]
# They are for a bench: the keys have no password and the authorities sign for anybody who has this folder.
set -eu
LC_ALL=C; export LC_ALL
folder=${1:-$(dirname "$0")/certificates}
mkdir -p "$folder"
cd "$folder"
key="-newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes"

for name in ca strangers; do
    openssl req -x509 $key -keyout $name.key -out $name.pem -days 3650 -subj "/CN=$name" 2>/dev/null
done

# sign NAME AUTHORITY DAYS EXTENSIONS
sign() {
    printf '%b\n' "$4" > extensions
    openssl req $key -keyout $1.key -out request -subj "/CN=$1" 2>/dev/null
    openssl x509 -req -in request -CA $2.pem -CAkey $2.key -CAcreateserial -out $1.pem -days $3 \
        -extfile extensions 2>/dev/null
}
sign plc ca 3650 'subjectAltName=IP:127.0.0.1,DNS:plc.line.local'
sign partner ca 3650 'subjectAltName=IP:127.0.0.1,DNS:partner.line.local'
sign elsewhere ca 3650 'subjectAltName=IP:10.9.8.7,DNS:elsewhere.line.local'
sign expired ca -1 'subjectAltName=IP:127.0.0.1'
sign strange strangers 3650 'subjectAltName=IP:127.0.0.1,DNS:plc.line.local'
sign critical ca 3650 'subjectAltName=IP:127.0.0.1\n1.2.3.4=critical,ASN1:UTF8String:unknown'

# Not valid before 2099: only `openssl ca` can say that in every version.
: > index
printf '%s\n' '[a]' 'database=index' 'serial=ca.srl' 'new_certs_dir=.' 'default_md=sha256' 'policy=p' \
    '[p]' 'commonName=supplied' > ca.conf
openssl req $key -keyout early.key -out request -subj "/CN=early" 2>/dev/null
openssl ca -batch -config ca.conf -name a -cert ca.pem -keyfile ca.key -in request -out early.pem -notext \
    -startdate 20990101000000Z -enddate 20991231000000Z 2>/dev/null
rm -f request extensions index* ca.conf ca.srl* strangers.srl [0-9A-F][0-9A-F]*.pem
