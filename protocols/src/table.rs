//! Macros for the enums and counters of the generated code.

/// An enum with a wire code for each variant, the list of all variants, and their names.
macro_rules! wire_enum {
    ($(#[$doc:meta])* pub enum $name:ident: $code:ty {
        $($(#[$variant_doc:meta])* $variant:ident = $value:literal,)+
    }) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        #[repr($code)]
        pub enum $name { $($(#[$variant_doc])* $variant = $value,)+ }

        impl $name {
            /// All variants, in the order of their codes.
            pub const ALL: &'static [Self] = &[$(Self::$variant),+];

            /// The code on the wire.
            pub const fn code(self) -> $code { self as $code }

            /// The variant with this code.
            pub const fn from_code(code: $code) -> Option<Self> {
                match code { $($value => Some(Self::$variant),)+ _ => None }
            }

            /// The name in the ICD.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$variant => stringify!($variant),)+ }
            }
        }
    };
}
pub(crate) use wire_enum;

/// The structure of the counters and their names, in the order of the wire.
macro_rules! counters {
    ($($(#[$doc:meta])* $name:ident,)+) => {
        /// Counts since the emulator started, modulo 2^32; in this order on the wire.
        #[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
        pub struct Counters { $($(#[$doc])* pub $name: u32,)+ }

        impl Counters {
            /// The names, in the order of the fields.
            pub const NAMES: &'static [&'static str] = &[$(stringify!($name)),+];

            /// Names and values, in the order of the fields.
            pub fn iter(&self) -> impl Iterator<Item = (&'static str, u32)> + use<> {
                Self::NAMES.iter().copied().zip([$(self.$name),+])
            }

            pub(crate) fn iter_mut(&mut self) -> impl Iterator<Item = &mut u32> {
                [$(&mut self.$name),+].into_iter()
            }
        }
    };
}
pub(crate) use counters;
