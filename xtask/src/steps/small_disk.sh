# Runs a program on a disk of half a megabyte, mounted for it alone; run under unshare, so that nobody else sees it.
#   sh small_disk.sh DISK KEPT PROGRAM WORDS...
# What the program tells and its log are in KEPT when the disk is gone.
disk=$1 kept=$2
shift 2
mount -t tmpfs -o size=512k sinew-hardship "$disk" || exit 97
"$@" --out "$disk/out" 2> "$kept/told.txt"
code=$?
cp "$disk/out/run.mcap" "$kept/run.mcap" || exit 98
exit $code
