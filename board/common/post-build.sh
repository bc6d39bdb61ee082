#!/bin/sh
# post-build.sh TARGET BOARD: Buildroot calls it when the root's files are together, before they are
# packed. It completes the slot. ODID_BUILD_TIME is the time that the clock starts from, ODID_TRUSTED
# the certificates of those whose updates it takes.
set -eu
target=$1 board=$2
project=$(cd "$(dirname "$0")/../.." && pwd)

mkdir -p "$target/boot" "$target/var"

# What packages bring and nothing here uses.
rm -rf "$target/usr/share/udhcpc" "$target/usr/lib/udev" "$target/etc/profile.d"
rm -f "$target/linuxrc" "$target/etc/os-release" "$target/usr/lib/os-release" \
	"$target/usr/bin/captest" "$target/usr/bin/filecap" "$target/usr/bin/netcap" "$target/usr/bin/pscap" \
	"$target/usr/bin/scmp_sys_resolver"
rm -f "$target/usr/bin/nettle-"* "$target/usr/bin/pkcs1-conv" "$target/usr/bin/sexp-conv" \
	"$target/usr/bin/wcurl" "$target/bin/compile_et" "$target/bin/mk_cmds" \
	"$target/usr/bin/compile_et" "$target/usr/bin/mk_cmds"
# The compiler's; a program may ask for it although it uses nothing of it.
if ! grep -rqs "libatomic\\.so" "$target/bin" "$target/sbin" "$target/usr/bin" "$target/usr/sbin" "$target/usr/lib"/lib[!a]*; then
	rm -f "$target/lib/libatomic.so"* "$target/usr/lib/libatomic.so"*
fi
# Libraries that nothing here is linked with (tests/release).
for library in libbluetooth libconfig++ libdrop_ambient libgmpxx libgomp libhogweed libINIReader \
	libnl-idiag-3 libnl-nf-3 libnl-route-3 libnl-xfrm-3 libss; do
	rm -f "$target/lib/$library.so"* "$target/usr/lib/$library.so"*
done
rm -rf "$target/usr/lib/ossl-modules"

# rcS runs every S* script there is: those that packages bring are not for this appliance.
for script in "$target/etc/init.d/"*; do
	[ -e "$project/overlay/etc/init.d/${script##*/}" ] || rm -f "$script"
done

# Services that somebody's own layer adds are supervised as well, after those of the appliance.
for service in "$target/etc/sv/"*; do
	name=${service##*/}
	grep -q " /run/service/$name\$" "$target/etc/inittab" && continue
	[ -x "$service/run" ] || { echo "the service $name: there is no /etc/sv/$name/run that can be run" >&2 && exit 1; }
	ln -sf /lib/odid/finish "$service/finish"
	echo "::respawn:/usr/bin/runsv /run/service/$name" >>"$target/etc/inittab"
done

# Users: root, nobody, and those of users.txt, which come later.
sed -i -n -e '/^root:/p' -e '/^nobody:/p' "$target/etc/passwd" "$target/etc/shadow"

version=$(sed -n 's/^project(odid-daemon VERSION \([0-9.]*\).*/\1/p' "$project/package/odid-daemon/CMakeLists.txt")
sed -i -e "s/@VERSION@/${version:?}/" -e "s/@BUILD_TIME@/${ODID_BUILD_TIME:?}/" -e "s/@BOARD@/$board/" \
	"$target/etc/odid-release"
echo "$version" >"$target/etc/odid/version"

# What updates need: whom to trust, and what the boot loader has where its environment says nothing.
install -D -m 644 "${ODID_TRUSTED:?}" "$target/etc/swupdate/trusted.pem"
cp "$project/board/$board/u-boot.env" "$target/etc/u-boot-initial-env"

# The board's device tree by the name that boot.cmd knows, and the script that fits it to the board.
# QEMU hands its own over.
set -- "$BINARIES_DIR/"*.dtb
if [ -e "$1" ]; then
	rm -f "$target/boot/"*.dtb
	cp "$1" "$target/boot/board.dtb"
fi
if [ -e "$project/board/$board/board.cmd" ]; then
	mkimage -A arm64 -T script -C none -n board -d "$project/board/$board/board.cmd" "$target/boot/board.scr" >/dev/null
fi

# Of the radios' firmware only what this board's radios load.
if [ -e "$project/board/$board/firmware-files" ]; then
	rm -rf "$target/lib/firmware.part"
	while read -r name; do
		case $name in '' | '#'*) continue ;; esac
		[ -e "$target/lib/firmware/$name" ] || {
			echo "board/$board/firmware-files: no package brought $name" >&2
			exit 1
		}
		mkdir -p "$(dirname "$target/lib/firmware.part/$name")"
		cp -L "$target/lib/firmware/$name" "$target/lib/firmware.part/$name"
	done <"$project/board/$board/firmware-files"
	rm -rf "$target/lib/firmware"
	mv "$target/lib/firmware.part" "$target/lib/firmware"
fi
