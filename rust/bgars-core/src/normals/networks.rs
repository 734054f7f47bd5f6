//! Networks of exchanges that sort, as macros: their places are to be literal, or the values do not stay in registers.

/// Calls a macro, with what else it is given first, then the pairs of places that sort eight values: a network of 19 exchanges
/// (Knuth, The Art of Computer Programming 3, section 5.3.4).
macro_rules! sort_eight {
    ($exchange:ident $($array:tt)*) => {
        $exchange!($($array)* 0 1, 2 3, 4 5, 6 7, 0 2, 1 3, 4 6, 5 7, 1 2, 5 6, 0 4, 1 5, 2 6, 3 7, 2 4, 3 5, 1 2, 3 4, 5 6)
    };
}
/// The same of 16: merge exchange (algorithm M in section 5.2.2).
macro_rules! sort_sixteen {
    ($exchange:ident $($array:tt)*) => {
        $exchange!($($array)*
            0 8, 1 9, 2 10, 3 11, 4 12, 5 13, 6 14, 7 15, 0 4, 1 5, 2 6, 3 7, 8 12, 9 13, 10 14, 11 15, 4 8, 5 9, 6 10,
            7 11, 0 2, 1 3, 4 6, 5 7, 8 10, 9 11, 12 14, 13 15, 2 8, 3 9, 6 12, 7 13, 2 4, 3 5, 6 8, 7 9, 10 12, 11 13,
            0 1, 2 3, 4 5, 6 7, 8 9, 10 11, 12 13, 14 15, 1 8, 3 10, 5 12, 7 14, 1 4, 3 6, 5 8, 7 10, 9 12, 11 14, 1 2,
            3 4, 5 6, 7 8, 9 10, 11 12, 13 14
        )
    };
}

/// The same of 24.
macro_rules! sort_twenty_four {
    ($exchange:ident $($array:tt)*) => {
        $exchange!($($array)*
            0 16, 1 17, 2 18, 3 19, 4 20, 5 21, 6 22, 7 23, 0 8, 1 9, 2 10, 3 11, 4 12, 5 13, 6 14, 7 15, 8 16, 9 17,
            10 18, 11 19, 12 20, 13 21, 14 22, 15 23, 0 4, 1 5, 2 6, 3 7, 8 12, 9 13, 10 14, 11 15, 16 20, 17 21, 18 22,
            19 23, 4 16, 5 17, 6 18, 7 19, 4 8, 5 9, 6 10, 7 11, 12 16, 13 17, 14 18, 15 19, 0 2, 1 3, 4 6, 5 7, 8 10,
            9 11, 12 14, 13 15, 16 18, 17 19, 20 22, 21 23, 2 16, 3 17, 6 20, 7 21, 2 8, 3 9, 6 12, 7 13, 10 16, 11 17,
            14 20, 15 21, 2 4, 3 5, 6 8, 7 9, 10 12, 11 13, 14 16, 15 17, 18 20, 19 21, 0 1, 2 3, 4 5, 6 7, 8 9, 10 11,
            12 13, 14 15, 16 17, 18 19, 20 21, 22 23, 1 16, 3 18, 5 20, 7 22, 1 8, 3 10, 5 12, 7 14, 9 16, 11 18, 13 20,
            15 22, 1 4, 3 6, 5 8, 7 10, 9 12, 11 14, 13 16, 15 18, 17 20, 19 22, 1 2, 3 4, 5 6, 7 8, 9 10, 11 12, 13 14,
            15 16, 17 18, 19 20, 21 22
        )
    };
}

pub(super) use {sort_eight, sort_sixteen, sort_twenty_four};

#[cfg(test)]
mod tests {
    macro_rules! exchange_bits {
        ($bits:ident: $($a:literal $b:literal),*) => {$(
            ($bits[$a], $bits[$b]) = ($bits[$a] & $bits[$b], $bits[$a] | $bits[$b]);
        )*};
    }

    /// A network sorts if it sorts all zeros and ones (Knuth, section 5.3.4, theorem Z): 64 of them at once, a bit each.
    #[test]
    fn networks_sort() {
        macro_rules! check {
            ($count:literal, $network:ident) => {
                for high in 0..1_u64 << ($count - 6) {
                    let mut bits: [u64; $count] = std::array::from_fn(|place| {
                        let counted = [0xAAAA_AAAA_AAAA_AAAA, 0xCCCC_CCCC_CCCC_CCCC, 0xF0F0_F0F0_F0F0_F0F0];
                        let wider = [0xFF00_FF00_FF00_FF00, 0xFFFF_0000_FFFF_0000, 0xFFFF_FFFF_0000_0000];
                        match place {
                            0..3 => counted[place],
                            3..6 => wider[place - 3],
                            _ => 0_u64.wrapping_sub(high >> (place - 6) & 1),
                        }
                    });
                    $network!(exchange_bits bits:);
                    assert!(bits.is_sorted_by(|lower, upper| lower & !upper == 0), "{high}");
                }
            };
        }
        check!(8, sort_eight);
        check!(16, sort_sixteen);
        check!(24, sort_twenty_four);
    }
}
