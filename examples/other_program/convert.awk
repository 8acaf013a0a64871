# From CalculiX's .dat files, named cam-TORQUE.dat, to samples: step 3 has the load on, each step after it turns the generator by a
# quarter of a tooth pitch. Nothing in the deck opposes the motion, so both directions have the same angle; the drive is its own
# mirror image, so a load of the other sign has the angles of the other sign.
BEGIN {
    print "generator_rad,torque_n_m,temperature_c,direction,output_rad"
    quarter = 2 * atan2(0, -1) / 188 / 4
}
/for set OUTPUT/ { step = $NF - 3; next }
NF == 4 && step >= 0 && step < 4 {
    torque = FILENAME
    gsub(/^.*cam-|\.dat$/, "", torque)
    for (sign = 1; sign >= -1; sign -= 2)
        for (direction = 1; direction >= -1; direction -= 2)
            printf "%.12f,%g,20,%d,%.6e\n", sign * step * quarter, sign * torque, direction, sign * $2
}
