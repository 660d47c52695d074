#!/bin/sh
# Writes an assembler file that embeds files unchanged, and the table of them: embed.sh SYMBOL FILE...
# The table is `const struct embedded_file SYMBOL[]` of renderer/embed.h, ended by a NULL name.
set -eu
symbol=$1
shift
echo '	.section .rodata'
i=0
for file; do
	printf 'name_%s_%d: .asciz "%s"\ndata_%s_%d: .incbin "%s"\nend_%s_%d: .byte 0\n' \
		"$symbol" $i "$file" "$symbol" $i "$file" "$symbol" $i
	i=$((i + 1))
done
printf '	.section .data.rel.ro,"aw"\n	.balign 8\n	.globl %s\n%s:\n' "$symbol" "$symbol"
i=0
for file; do
	printf '	.quad name_%s_%d, data_%s_%d, end_%s_%d - data_%s_%d\n' \
		"$symbol" $i "$symbol" $i "$symbol" $i "$symbol" $i
	i=$((i + 1))
done
echo '	.quad 0, 0, 0'
echo '	.section .note.GNU-stack,"",%progbits'
