#!/bin/sh
# make-keys.sh DIR: makes what bundles are signed with, unless DIR has it already (docs/keys.md):
#   signing.key   the private key: who has it can put anything on every aircraft that trusts it
#   signing.crt   its certificate
#   trusted.pem   the certificates that images trust, one after the other; at first that one
set -eu
dir=$1

if [ -s "$dir/trusted.pem" ]; then
	exit 0
fi
if [ -e "$dir/signing.key" ]; then
	echo "$dir: there is a signing.key, but no trusted.pem: put the certificates that images are to trust there" >&2
	exit 1
fi
umask 077
mkdir -p "$dir"
work=$(mktemp -d "$dir/.making.XXXXXX")
trap 'rm -rf "$work"' EXIT

# Boards have no clock battery, so the certificate is valid at every time that a clock may show;
# of openssl's commands only "ca" takes a first day, and it wants a register of what it issued.
: >"$work/register"
cat >"$work/openssl.cnf" <<END
[ca]
default_ca = own
[own]
database = $work/register
new_certs_dir = $work
rand_serial = yes
default_md = sha256
policy = any
x509_extensions = certificate
[any]
commonName = supplied
[certificate]
basicConstraints = critical, CA:FALSE
keyUsage = critical, digitalSignature
subjectKeyIdentifier = hash
[req]
distinguished_name = name
[name]
END
name=${2:-development $(od -An -N4 -tx4 /dev/urandom | tr -d ' ')}
openssl ecparam -name prime256v1 -genkey -noout -out "$work/signing.key"
openssl req -new -config "$work/openssl.cnf" -key "$work/signing.key" -subj "/CN=Remote ID bundles, $name" \
	-out "$work/request"
openssl ca -batch -notext -selfsign -config "$work/openssl.cnf" -keyfile "$work/signing.key" \
	-startdate 19700101000000Z -enddate 99991231235959Z -in "$work/request" -out "$work/signing.crt" 2>"$work/log" || {
	cat "$work/log" >&2
	exit 1
}
chmod 644 "$work/signing.crt"
mv "$work/signing.key" "$work/signing.crt" "$dir/"
cp "$dir/signing.crt" "$dir/trusted.pem"
echo "keys: made a key pair in $dir"
