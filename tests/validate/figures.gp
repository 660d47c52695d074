# Draws figure{4,6,8,9}.svg and passes.svg: gnuplot -e "data='FOLDER'; out='FOLDER'" figures.gp; with png=1 as PNG.
# Colours after M. Okabe and K. Ito, which the colour-blind tell apart; an order of scattering has the same one everywhere.
if (!exists("png")) png = 0
svg = "svg size 800,%d font 'sans-serif,13' background 'white'"
raster = "pngcairo size 800,%d font 'sans,10'"
start(name, height) = sprintf("set terminal %s; set output '%s/%s.%s'", sprintf(png ? raster : svg, height), out, name, png ? "png" : "svg")
file(name) = sprintf("%s/%s.tsv", data, name)

blue = "#0072B2"; orange = "#E69F00"; green = "#009E73"; red = "#D55E00"; sky = "#56B4E9"; pink = "#CC79A7"; yellow = "#F0E442"
grey = "#999999"
set datafile separator "\t"
axes = "set border 3 lw 1; set xtics nomirror out; set ytics nomirror out; set grid xtics ytics lc rgb '#dddddd' lw 1 dt 1"
eval axes

# --- figure 4: phase function -------------------------------------------------------------------------------------------------------
eval start("figure4", 480)
set multiplot
set logscale y
set key outside top center horizontal samplen 2 width -2
set xlabel "scattering angle in degrees"
set ylabel "phase function P (isotropic: 1)"
set xrange [0:180]; set xtics 30
set yrange [0.003:20000]; set format y "10^{%L}"
plot NaN with lines lc rgb red lw 1.8 title "650 nm", \
	NaN with lines lc rgb green lw 1.8 title "550 nm", \
	NaN with lines lc rgb blue lw 1.8 title "450 nm", \
	file("figure4") using 1:5 with lines lc rgb grey lw 0.7 title "one of 20 µm", \
	for [k = 2:4] "" every 2 using 1:k with lines lc rgb (k == 2 ? red : k == 3 ? green : blue) lw 1.8 notitle
# The inset: log P from 0.01 as radius, forward to the right, both halves.
unset logscale; unset key; unset border; unset tics; unset xlabel; unset ylabel; unset grid
set size 0.5,0.52; set origin 0.44,0.37
set size ratio -1
set xrange [-3.2:6.4]; set yrange [-2.6:2.6]
rho(p) = (log10(p) + 2 > 0 ? log10(p) + 2 : 0)
x(angle, p) = rho(p) * cos(angle * pi / 180)
y(angle, p) = rho(p) * sin(angle * pi / 180)
set object 1 circle at 0,0 size 2 fs empty border lc rgb "#bbbbbb"
set label 1 "P = 1" at -1.9,1.6 textcolor rgb "#777777" font ",10"
set label 2 "forward" at 4.0,0.6 textcolor rgb "#777777" font ",10"
plot for [side = -1:1:2] file("figure4") every 2 using (x($1, $5)):(side * y($1, $5)) with lines lc rgb grey lw 0.4, \
	for [k = 2:4] for [side = -1:1:2] "" every 4 using (x($1, column(k))):(side * y($1, column(k))) with lines \
		lc rgb (k == 2 ? red : k == 3 ? green : blue)
unset multiplot
unset object 1; unset label 1; unset label 2
set size noratio; set size 1,1; set origin 0,0
eval axes
set format y "%g"

# --- figure 6: reflected radiance by orders -----------------------------------------------------------------------------------------
eval start("figure6", 760)
set key at graph 1.02,0.95 left top vertical Left reverse samplen 2 width 0 noinvert
set lmargin 10; set rmargin 20
set xrange [-88:88]; set xtics -90,30,90
set yrange [0:0.75]
set nonlinear y via sqrt(y) inverse y*y
set ytics (0, 0.01, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7)
set style fill solid 0.9 noborder
set ylabel "radiance for F_0 = 1, in 1/sr (square root scale)"
array shade[6] = [blue, sky, green, yellow, orange, red]
set label 1 "A glory" at -70,0.13 center
set label 2 "B fogbow" at -32,0.06 center
set label 3 "C pseudo-specular" at 50,0.2 right
set multiplot layout 2,1
do for [full = 0:1] {
	set title (full ? "full phase function" : "modified phase function (without the forward peak)") font ",14"
	set xlabel (full ? "zenith angle of the view in degrees (sun behind the viewer: negative)" : "")
	plot for [k = 6:1:-1] file("figure6") using 1:(column(1 + 6*full + k)) with filledcurves y1=0 lc rgb shade[k] \
			title (k == 6 ? "6 and more" : sprintf("order %d", k)), \
		"" using 1:3 with lines dt 2 lw 1.8 lc rgb "black" title (full ? "1+2 modified" : "1+2"), \
		"" using 1:14 with lines lw 1.5 lc rgb "black" title "solver, sum"
}
unset multiplot
unset label 1; unset label 2; unset label 3; unset title
unset lmargin; unset rmargin

# --- figure 8: fluxes over the thickness ---------------------------------------------------------------------------------------------
eval start("figure8", 440)
unset nonlinear y
set logscale x
set xrange [1:1000]; set xtics (1, 3, 10, 30, 100, 300, 1000)
set key outside top center horizontal Left reverse samplen 1.5 width -2
set xlabel "thickness H in m"
array tint[4] = [pink, blue, sky, green]
array order[4] = ["i = 0", "1", "2", "3+"]
form = "lw 7 lc rgb '#66cccccc'"
set multiplot layout 1,2
set ylabel "fraction of the incident flux"
set yrange [0:1]; set ytics 0.2
set title "transmitted, T_i" font ",14"
plot for [k = 1:4] file("figure8") using 1:(column(8 + k)) with lines @form notitle, \
	for [k = 1:4] "" using 1:(column(1 + k)) with lines lc rgb tint[k] lw 2 title order[k], \
	for [k = 1:4] file("figure8dots") using 1:(column(1 + k)) with points pt 7 ps 0.5 lc rgb "black" notitle
set ylabel "the same, logarithmic"
set logscale y; set yrange [1e-4:1]; set ytics auto; set format y "10^{%L}"
set title "reflected, R_i" font ",14"
plot for [k = 2:4] file("figure8") using 1:(column(11 + k)) with lines @form notitle, \
	for [k = 2:4] "" using 1:(column(4 + k)) with lines lc rgb tint[k] lw 2 notitle, \
	for [k = 2:4] file("figure8dots") using 1:(column(4 + k)) with points pt 7 ps 0.5 lc rgb "black" notitle, \
	NaN with lines @form title "form", NaN with lines lc rgb "black" lw 2 title "solver", \
	NaN with points pt 7 ps 0.5 lc rgb "black" title "photons"
unset multiplot
unset title
unset logscale

# --- figure 9: radiance of two slabs ---------------------------------------------------------------------------------------------------
eval start("figure9", 800)
set xrange [-88:88]; set xtics -60,30,60
set key outside top center horizontal Left reverse samplen 1.5 width -2
set style fill solid 0.8 noborder
array area[4] = [green, sky, blue, pink]
array part[4] = ["3+", "2", "1", "0"]
array case[2] = ["H = 100 m, sun at 70°", "H = 5 m, sun at 80°"]
set multiplot layout 2,2
do for [side = 0:1] { do for [number = 0:1] {
	set title sprintf("%s, %s", side ? "transmitted" : "reflected", case[number + 1]) font ",13"
	set ylabel (number ? "" : side ? "radiance, 1/sr (logarithmic)" : "radiance for F_0 = 1, in 1/sr (square root scale)")
	set xlabel (side ? "zenith angle of the view in degrees" : "")
	if (side) {
		unset nonlinear y
		set logscale y; set ytics auto; set format y "10^{%L}"
		set yrange [(number ? 2e-4 : 0.01):(number ? 300 : 2)]
	} else {
		unset logscale y
		set nonlinear y via sqrt(y) inverse y*y
		set format y "%g"; set yrange [0:1]; set ytics (0, 0.001, 0.01, 0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 1)
	}
	form_key = side == 0 && number == 0
	other_key = side == 0 && number == 1
	bottom = side ? 1e-6 : 0
	plot for [k = 4:1:-1] file(sprintf("figure9curves%d", number)) every 2 using 1:(column(1 + 5*side + k)) with filledcurves y1=bottom lc rgb area[k] \
			title (form_key ? part[k] : ""), \
		"" every 2 using 1:(column(6 + 5*side)) with lines lw 1.5 lc rgb "black" title (other_key ? "solver" : ""), \
		file(sprintf("figure9dots%d", number)) using 1:(column(2 + 2*side) - 2*column(3 + 2*side)):(0):(4*column(3 + 2*side)) with vectors nohead lc rgb red notitle, \
		"" using 1:(column(2 + 2*side)) with points pt 7 ps 0.45 lc rgb red title (other_key ? "photons" : "")
} }
unset multiplot

# --- passes of the exchange -----------------------------------------------------------------------------------------------------------
reset
set datafile separator "\t"
eval axes
eval start("passes", 360)
set key outside right center vertical Left reverse samplen 2
set logscale y; set format y "10^{%L}"
set xrange [0.8:8.2]; set xtics 1
set yrange [1e-7:1]
set xlabel "passes"
set ylabel "residual"
set arrow 1 from 0.8,1e-3 to 8.2,1e-3 nohead lc rgb grey dt 2
set label 1 "default tolerance" at 8.1,1.6e-3 right textcolor rgb "#777777" font ",10"
array curve[5] = [blue, sky, green, orange, red]
plot for [k = 0:4] file("passes") index k using 1:2 with linespoints pt 7 ps 0.5 lw 1.6 lc rgb curve[k + 1] title columnheader(1)
