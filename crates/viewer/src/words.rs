//! Messages in words for the page: without options and commands, which have no meaning there.

/// Phrases of messages for the command line, and what they are on the page.
const PHRASES: [(&str, &str); 6] = [
    (" (`snell formats` says more)", ""),
    (" (--confine, confine=True)", ""),
    ("; --camera shows the others: ", "; the others are in the panel, under Camera: "),
    ("give --aov instead", "choose a layer in the panel, under Show, instead"),
    ("use --seed instead", "the seed is one of the settings of the picture"),
    (
        "light from all around, and so does --environment sky, or a picture in place of sky",
        "light from all around, and so does a picture that is chosen under Surroundings",
    ),
];

/// A message with phrases of the command line replaced.
pub fn for_page(message: &str) -> String {
    PHRASES.iter().fold(message.to_string(), |text, (from, to)| text.replace(from, to))
}
